-- A session of Neovim: opens scene.rhai, and writes what the server shows to shown.txt.
local shown = {}
local client = vim.lsp.start_client({ name = "choreo", cmd = { vim.env.CHOREO, "lsp" }, root_dir = vim.fn.getcwd() })
vim.cmd("edit scene.rhai")
vim.lsp.buf_attach_client(0, client)

local function ask(method, line, column)
  local p = { textDocument = vim.lsp.util.make_text_document_params(0), position = { line = line, character = column } }
  local answers = vim.lsp.buf_request_sync(0, method, p, 60000)
  return answers and answers[client] and answers[client].result
end

vim.wait(60000, function() return #vim.diagnostic.get(0) > 0 end, 20)
for _, d in ipairs(vim.diagnostic.get(0)) do
  table.insert(shown, string.format("diagnostic %d:%d %s", d.lnum + 1, d.col + 1, vim.split(d.message, "\n")[1]))
end
-- Behind the opening quote of the clip's name.
local list
vim.wait(60000, function()
  list = ask("textDocument/completion", 2, 20)
  return list and not list.isIncomplete
end, 100)
for _, item in ipairs(list and list.items or {}) do
  table.insert(shown, "item " .. item.label .. " " .. (item.detail or ""))
end
local about = ask("textDocument/hover", 2, 6)
for _, line in ipairs(vim.split(about and about.contents.value or "nothing", "\n")) do
  table.insert(shown, "hover " .. line)
end
vim.fn.writefile(shown, "shown.txt")
vim.cmd("qa!")

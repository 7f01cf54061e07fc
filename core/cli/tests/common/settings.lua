-- Types a script in Neovim with the documented settings, as a user does: completes a clip, formats when it is written. Writes what is
-- shown to shown.txt.
local shown = {}
vim.cmd("edit scene.rhai")
vim.wait(60000, function() return #vim.diagnostic.get(0) > 0 end, 20)
for _, d in ipairs(vim.diagnostic.get(0)) do
  table.insert(shown, string.format("diagnostic %d:%d %s", d.lnum + 1, d.col + 1, vim.split(d.message, "\n")[1]))
end
-- Behind the name of the clip.
local line = vim.fn.search("clip(")
vim.fn.cursor(line, vim.fn.match(vim.fn.getline(line), "Slid") + 5)
local found
vim.wait(60000, function()
  local params = vim.lsp.util.make_position_params(0, "utf-16")
  local answers = vim.lsp.buf_request_sync(0, "textDocument/completion", params, 60000)
  for _, answer in pairs(answers or {}) do found = answer.result end
  return found and not found.isIncomplete
end, 100)
for _, item in ipairs(found and found.items or {}) do table.insert(shown, "item " .. item.label) end
vim.fn.setline(line, (vim.fn.getline(line):gsub("Slid", "Slide")))
vim.cmd("write")
vim.wait(60000, function() return #vim.diagnostic.get(0) == 0 end, 20)
table.insert(shown, #vim.diagnostic.get(0) .. " diagnostics")
table.insert(shown, "line " .. vim.fn.readfile("scene.rhai")[line])
table.insert(shown, "omnifunc " .. vim.bo.omnifunc)
vim.fn.writefile(shown, "shown.txt")
vim.cmd("qa!")

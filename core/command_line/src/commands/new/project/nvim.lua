-- Neovim 0.9 or newer reads this file where `:set exrc` is on; elsewhere the lines belong into init.lua.
vim.api.nvim_create_autocmd({ "BufRead", "BufNewFile" }, { pattern = "*.rhai", command = "setfiletype rhai" })
vim.api.nvim_create_autocmd("FileType", { pattern = "rhai", callback = function(e)
  local here = vim.fn.fnamemodify(e.file, ":p:h")
  local project = vim.fn.findfile("choreo.toml", here .. ";")
  local settings = { name = "choreo", cmd = { "choreo", "lsp" },
    root_dir = project == "" and here or vim.fn.fnamemodify(project, ":p:h") }
  if vim.lsp.start then
    vim.lsp.start(settings)
  else -- 0.7
    ChoreoClient = ChoreoClient or vim.lsp.start_client(settings)
    vim.lsp.buf_attach_client(e.buf, ChoreoClient)
  end
  vim.bo[e.buf].omnifunc = "v:lua.vim.lsp.omnifunc" -- Ctrl-X Ctrl-O completes
end })

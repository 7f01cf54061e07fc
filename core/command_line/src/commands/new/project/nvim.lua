-- Neovim 0.9 or newer reads this file where `:set exrc` is on; elsewhere the lines belong into init.lua.
vim.filetype.add({ extension = { rhai = "rhai" } })
vim.api.nvim_create_autocmd("FileType", { pattern = "rhai", callback = function(e)
  vim.lsp.start({ name = "choreo", cmd = { "choreo", "lsp" },
    root_dir = vim.fs.dirname(vim.fs.find({ "choreo.toml", ".git" }, { upward = true, path = e.file })[1]) })
end })

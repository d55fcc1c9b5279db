-- Comments, indentation, `:make` (plctool check) and `gq` (plctool fmt) for Structured Text.
local command = vim.fn.shellescape(require('plctool').command)

vim.bo.commentstring = '// %s'
vim.bo.comments = 's1:(*,mb:*,ex:*),://'
vim.bo.shiftwidth = 4
vim.bo.expandtab = true
vim.bo.autoindent = true
vim.bo.makeprg = command .. ' check'
vim.bo.errorformat = '%f:%l:%c: %trror: %m,%f:%l:%c: %tarning: %m,%-G%.%#'
vim.bo.formatprg = command .. ' fmt -'
if vim.treesitter.foldexpr and #vim.api.nvim_get_runtime_file('parser/iecst.so', false) > 0 then
  vim.wo.foldmethod = 'expr'
  vim.wo.foldexpr = 'v:lua.vim.treesitter.foldexpr()'
  vim.wo.foldlevel = 99
end

if vim.g.plctool_setup ~= false then
  require('plctool').setup()
end

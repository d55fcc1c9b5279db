-- Structured Text in Neovim: the tree-sitter parser, the language server and the debug adapter of plctool.
--
--   require('plctool').setup { command = '/opt/plctool/bin/plctool', link = 'tcp:192.168.0.5' }
--
-- is needed only for other settings than these (with `let g:plctool_setup = v:false` before).

local M = { command = 'plctool', link = nil, lsp = true, highlight = true }

local here = vim.fn.fnamemodify(debug.getinfo(1, 'S').source:sub(2), ':p:h:h')

local function environment()
  return M.link and { PLC_LINK = M.link } or nil
end

--- Compiles the parser of editors/tree-sitter-iecst, which needs a C compiler only.
function M.install_parser()
  local sources = here .. '/../tree-sitter-iecst/src'
  local parser = vim.fn.stdpath('data') .. '/site/parser/iecst.so'
  vim.fn.mkdir(vim.fn.fnamemodify(parser, ':h'), 'p')
  local files = { sources .. '/parser.c', sources .. '/scanner.c' }
  local said = vim.fn.system({ vim.env.CC or 'cc', '-shared', '-fPIC', '-O2', '-I' .. sources, files[1], files[2], '-o', parser })
  if vim.v.shell_error ~= 0 then
    vim.notify('plctool: the parser was not compiled: ' .. said, vim.log.levels.ERROR)
  end
  return vim.v.shell_error == 0
end

local function has_parser()
  return #vim.api.nvim_get_runtime_file('parser/iecst.so', false) > 0
end

local function highlight(buffer)
  if vim.treesitter.start then -- since Neovim 0.9
    vim.treesitter.start(buffer, 'iecst')
  else
    vim.treesitter.highlighter.new(vim.treesitter.get_parser(buffer, 'iecst'))
  end
end

local function root_of(buffer)
  local file = vim.api.nvim_buf_get_name(buffer)
  local project = vim.fn.findfile('plc.toml', vim.fn.fnamemodify(file, ':p:h') .. ';')
  return vim.fn.fnamemodify(project ~= '' and project or file, ':p:h')
end

local clients = {}

local function attach(buffer)
  local root = root_of(buffer)
  local config = { name = 'plctool', cmd = { M.command, 'lsp' }, cmd_env = environment(), root_dir = root }
  if vim.lsp.start then -- since Neovim 0.8
    vim.lsp.start(config, { bufnr = buffer })
  else
    clients[root] = clients[root] or vim.lsp.start_client(config)
    vim.lsp.buf_attach_client(buffer, clients[root])
  end
end

local function ask_for_link()
  return vim.fn.input('Controller: ', 'serial:/dev/ttyS0')
end

local function set_up_debugging()
  local found, dap = pcall(require, 'dap')
  if not found then return end
  dap.adapters.plctool = { type = 'executable', command = M.command, args = { 'dap' }, options = { env = environment() } }
  dap.configurations.iecst = {
    { type = 'plctool', request = 'launch', name = 'Debug in the simulator', program = '${workspaceFolder}' },
    { type = 'plctool', request = 'attach', name = 'Debug on the controller', link = M.link or ask_for_link },
  }
end

function M.setup(settings)
  for name, value in pairs(settings or {}) do M[name] = value end
  vim.cmd('command! PlctoolInstallParser lua require("plctool").install_parser()')
  vim.cmd('augroup plctool | autocmd! | augroup END')
  vim.cmd('autocmd plctool FileType iecst lua require("plctool").begin()')
  set_up_debugging()
end

function M.begin()
  local buffer = vim.api.nvim_get_current_buf()
  if M.highlight and has_parser() then highlight(buffer) end
  if M.lsp and vim.fn.executable(M.command) == 1 then attach(buffer) end
end

return M

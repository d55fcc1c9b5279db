" Neovim takes .st for Smalltalk.
autocmd BufRead,BufNewFile *.st,*.iec,*.exp,*.EXP set filetype=iecst
autocmd BufRead,BufNewFile *.TcPOU,*.TcDUT,*.TcGVL,*.TcIO set filetype=xml

"""The language server: what `plctool lsp` answers to an editor (Language Server Protocol 3.17)."""

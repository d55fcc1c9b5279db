"""Pages of a library or program, made of its declarations and their comments: what `plctool doc` writes."""

"""Finding and reading programs: files, projects, libraries, archives."""

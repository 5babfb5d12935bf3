"""Host services for commands: files, cache paths, exit statuses, option parsing, shell completion."""

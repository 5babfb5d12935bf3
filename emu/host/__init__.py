"""Host services of the commands: files, cache paths, exit statuses, option parsing, shell completion."""

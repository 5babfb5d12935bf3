"""What the commands need of the host: files, cache paths, exit status, option parsing, shell completion."""

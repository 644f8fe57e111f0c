"""The command line tool `hand`: one module a subcommand."""

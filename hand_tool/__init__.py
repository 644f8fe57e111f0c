"""The command line tool `hand`: one module per subcommand.

A module of a subcommand imports at its top only what its options need, so that `hand --help` is quick and a
missing file is reported before libraries that take seconds are loaded.
"""

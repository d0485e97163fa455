"""The `rolling-panda` command and its subcommands that belong to no process."""

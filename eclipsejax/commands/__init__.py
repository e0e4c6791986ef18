"""The subcommands of `eclipsejax`, a module each. Heavy libraries load where they are used, not here."""

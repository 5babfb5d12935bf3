"""DWARF output: scopes, variables, locations, types and call frames."""

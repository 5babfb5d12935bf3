"""DWARF debug information: scopes, variables, locations, types, line table and call frames."""

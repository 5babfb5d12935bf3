"""The experiments of the project, one module each; the module's name is the experiment's name."""

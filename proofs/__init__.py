"""Machine-checked statements, independent of the tool: nothing here imports `robust`."""

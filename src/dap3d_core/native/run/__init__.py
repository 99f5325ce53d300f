"""The run of an exported model: memory, parameters, outputs, derivatives."""

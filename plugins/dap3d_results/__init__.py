"""Results as files of other programs: VTK, glTF, MATLAB, tables."""

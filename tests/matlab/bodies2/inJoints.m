function inJoints
include_global
J1 = Joint_struct;          % there are none

Joints = [];

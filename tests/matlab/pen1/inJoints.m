function inJoints
include_global

J1 = Joint_struct;
J1.type = 'sph';
J1.iPindex = 1;
J1.jPindex = 2;

Joints = [J1];

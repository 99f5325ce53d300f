function inJoints
include_global

J1 = Joint_struct;
J1.type = 'sph';
J1.iPindex = 2; J1.jPindex = 1;   % a point on the ground is jPindex

J2 = Joint_struct;
J2.type = 'rev';
J2.iPindex = 4; J2.jPindex = 3;
J2.iVindex_a = 2; J2.jVindex_a = 1;

Joints = [J1; J2];

function inJoints
include_global

J1 = Joint_struct; J1.type = 'rev';
J1.iPindex = 1; J1.jPindex = 6; J1.iVindex_a = 1; J1.jVindex_a = 2;

J2 = Joint_struct; J2.type = 'sph-sph';
J2.V2index = 1; J2.el = 6.4;

J3 = Joint_struct; J3.type = 'rev';
J3.iPindex = 4; J3.jPindex = 5; J3.iVindex_a = 3; J3.jVindex_a = 4;

J4 = Joint_struct; J4.type = 'rel-rot';
J4.iBindex = 1; J4.jBindex = 0; J4.jVindex_a = 2; J4.iFunct = 1;

Joints = [J1; J2; J3; J4];

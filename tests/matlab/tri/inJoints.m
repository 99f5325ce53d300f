function inJoints
include_global

J1 = Joint_struct; J1.type = 'rev';       % steering
J1.iPindex = 2; J1.jPindex = 1; J1.iVindex_a = 2; J1.jVindex_a = 1;
J2 = Joint_struct; J2.type = 'rev';       % front axle
J2.iPindex = 4; J2.jPindex = 3; J2.iVindex_a = 4; J2.jVindex_a = 3;
J3 = Joint_struct; J3.type = 'rev';       % left rear axle
J3.iPindex = 6; J3.jPindex = 5; J3.iVindex_a = 6; J3.jVindex_a = 5;
J4 = Joint_struct; J4.type = 'rev';       % right rear axle
J4.iPindex = 8; J4.jPindex = 7; J4.iVindex_a = 7; J4.jVindex_a = 5;

J5 = Joint_struct; J5.type = 'rel-rot';   % steers to the left and back
J5.iBindex = 1; J5.jBindex = 2; J5.jVindex_a = 2; J5.iFunct = 1;

J6 = Joint_struct; J6.type = 'disk';
J6.disk = 'xyz'; J6.iBindex = 3; J6.R = 0.2;
J7 = Joint_struct; J7.type = 'disk';
J7.disk = 'nz';  J7.iBindex = 4; J7.R = 0.2;
J8 = Joint_struct; J8.type = 'disk';
J8.disk = 'z';   J8.iBindex = 5; J8.R = 0.2;

Joints = [J1; J2; J3; J4; J5; J6; J7; J8];

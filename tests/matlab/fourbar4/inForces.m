function inForces
include_global

S1 = Force_struct;
S1.type = 'ptp';
S1.V2index = 1;
S1.k = 50; S1.el_0 = 8; S1.c = 0; S1.f_a = 0;

Forces = [S1];

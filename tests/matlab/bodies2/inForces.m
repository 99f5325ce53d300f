function inForces
include_global

S1 = Force_struct;
S1.type = 'ptp';
S1.V2index = 1;
S1.k = 100;
S1.c = 2;
S1.el_0 = 1.5;

S2 = S1;                    % the same but for its vector and its length
S2.V2index = 2;
S2.el_0 = 1.0;

S3 = Force_struct;
S3.type = 'weight';

Forces = [S1; S2; S3];

function inPoints
include_global

P1 = Point_struct;          % Q, the hook
P1.Bindex = 0;
P1.sPp = [0; 0; 3];

P2 = Point_struct;          % A
P2.Bindex = 1;
P2.sPp = [0.5; 0; 0];

P3 = Point_struct;          % B
P3.Bindex = 1;
P3.sPp = [0; 0.6; 0];

P4 = Point_struct;          % C
P4.Bindex = 2;
P4.sPp = [0; -0.6; 0];

Points = [P1; P2; ...
          P3; P4];

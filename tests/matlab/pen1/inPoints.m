function inPoints
include_global

P1 = Point_struct;
P1.Bindex = 1;
P1.sPp = [0; -0.3; 0];      % the tip

P2 = Point_struct;
P2.Bindex = 0;              % the ceiling
P2.sPp = [0; 0; 0];

Points = [P1; P2];

function inPoints
include_global

P1 = Point_struct; P1.Bindex = 0;
P1.sPp = [0; 0; 0];
P2 = Point_struct; P2.Bindex = 1;
P2.sPp = [0; -0.5; 0];
P3 = Point_struct; P3.Bindex = 1;
P3.sPp = -P2.sPp;
P4 = Point_struct; P4.Bindex = 2;
P4.sPp = [0; -0.3; 0];

Points = [P1; P2; P3; P4];

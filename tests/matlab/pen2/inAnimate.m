function inAnimate
include_global

P1 = Point_struct; P1.Bindex = 2; P1.sPp = [ 0.2; 0.2; 0];
P2 = Point_struct; P2.Bindex = 2; P2.sPp = [-0.2; 0.2; 0];
P3 = Point_struct; P3.Bindex = 2; P3.sPp = [ 0; 0.2;  0.2];
P4 = Point_struct; P4.Bindex = 2; P4.sPp = [ 0; 0.2; -0.2];
Points_anim = [P1; P2; P3; P4];

xmin = -1.6; xmax = 1.6; ymin = -1.6; ymax = 1.6;
zmin = -1.7; zmax = 0.6;

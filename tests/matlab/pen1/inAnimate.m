function inAnimate
include_global
% the rim of the base
b = 0.1;  R = 0.15;

P1 = Point_struct; P1.Bindex = 1; P1.sPp = [ R; b; 0];
P2 = Point_struct; P2.Bindex = 1; P2.sPp = [-R; b; 0];
P3 = Point_struct; P3.Bindex = 1; P3.sPp = [ 0; b; R];
P4 = Point_struct; P4.Bindex = 1; P4.sPp = [ 0; b; -R];
Points_anim = [P1; P2; P3; P4];

xmin = -0.5; xmax = 0.5;
ymin = -0.5; ymax = 0.5;
zmin = -0.6; zmax = 0.4;

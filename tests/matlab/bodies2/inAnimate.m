function inAnimate
include_global

P1 = Point_struct; P1.Bindex = 1; P1.sPp = [-0.5; 0; 0];
P2 = Point_struct; P2.Bindex = 1; P2.sPp = [0; -0.6; 0];
P3 = Point_struct; P3.Bindex = 2; P3.sPp = [0; 0.6; 0];
Points_anim = [P1; P2; P3];

% axes of the animation
xmin = -1.5; xmax = 1.5;
ymin = -2.5; ymax = 2.5;
zmin = -3;   zmax = 3.5;

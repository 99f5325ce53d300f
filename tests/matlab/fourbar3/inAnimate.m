function inAnimate
include_global

Points_anim = [];
xmin = -1.0; xmax = 5.0;
ymin = -2.5; ymax = 5.0;
zmin = -2.5; zmax = 7.5;

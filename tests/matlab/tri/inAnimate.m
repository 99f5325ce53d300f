function inAnimate
include_global

Points_anim = [];
xmin = -1; xmax = 6; ymin = -3; ymax = 3; zmin = 0; zmax = 2;

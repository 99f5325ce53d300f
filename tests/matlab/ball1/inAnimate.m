function inAnimate
include_global

Points_anim = [];
xmin = -0.6; xmax = 0.6; ymin = -0.6; ymax = 0.6; zmin = 0; zmax = 1.2;

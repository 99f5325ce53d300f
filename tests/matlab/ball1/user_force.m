function user_force
include_global
% contact of the ball with the ground: a spring and a damper that push upwards
depth = Bodies(1).r(3) - 0.1;
if depth < 0
    push = -2000*depth - 5*Bodies(1).r_dot(3);
    Bodies(1).f = Bodies(1).f + [0; 0; push];
end

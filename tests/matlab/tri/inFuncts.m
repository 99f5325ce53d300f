function inFuncts
include_global

C1 = Funct_struct;
C1.type = 'c';
C1.x_start = 1.0; C1.f_start = 0;
C1.x_end   = 4.0; C1.f_end   = 0;
C1.x_max   = 2.5; C1.f_max   = 0.3;

Functs = [C1];

function inFuncts
include_global
% one turn a second
C1 = Funct_struct;
C1.type = 'a';
C1.coeff = [0 2*pi 0];

Functs = [C1];

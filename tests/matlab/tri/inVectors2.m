function inVectors2
include_global

Vectors2 = [];

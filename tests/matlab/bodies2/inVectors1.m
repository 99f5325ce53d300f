function inVectors1
include_global

Vectors1 = [];

function inPoints
include_global

Points = [];

1
meshes/bent.g -c(0.95 0.5 0.1 1) Planar Rotational
Connections
0

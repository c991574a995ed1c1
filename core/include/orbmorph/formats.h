/* The mesh formats, one row each: the identifier in C and its value, the beginning of the names of its functions in
 * core, and the name in requests, options and reports. The enumeration orb_format, the table of readers and their
 * prototypes follow from this list. If two detectors are equally sure, the first row wins, so strict formats come
 * first. A new format takes the next value.
 *
 * Use: #define WORD(id, value, function, name) name, … ORB_FORMATS(WORD) */
#ifndef ORBMORPH_FORMATS_H
#define ORBMORPH_FORMATS_H

#define ORB_FORMATS(FORMAT)     \
  FORMAT(GLB, 6, glb, "glb")    \
  FORMAT(3MF, 7, 3mf, "3mf")    \
  FORMAT(PLY, 3, ply, "ply")    \
  FORMAT(GLTF, 5, gltf, "gltf") \
  FORMAT(OFF, 2, off, "off")    \
  FORMAT(STL, 4, stl, "stl")    \
  FORMAT(OBJ, 1, obj, "obj")

#endif

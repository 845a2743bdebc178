"""Files of other programs: FreeCAD assemblies (.asmt), MJCF (.xml, .mjcf) and URDF (.urdf)."""

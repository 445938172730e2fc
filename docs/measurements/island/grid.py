"""Writes a scene of PLACES places of MEMBERS instances each: python3 grid.py PLACES MEMBERS [curve] > grid.pbrt"""
import sys
places, members = int(sys.argv[1]), int(sys.argv[2])
shape = 'Shape "trianglemesh" "point3 P" [ 0 0 0  0.8 0 0  0.4 0.8 0.4 ]'
if "curve" in sys.argv:
    shape = 'Shape "curve" "point3 P" [ 0 0 0  0.3 0.2 0.3  0.5 0.6 0.3  0.8 0.8 0 ] "float width" 0.1'
def grid(count, name, step):
    side = int(count ** 0.5 + 0.999)
    for i in range(count):
        x, y = (i % side) * step, (i // side) * step
        print(f"AttributeBegin Translate {x} {y} 0 Rotate {i * 37 % 360} 0 0 1 ObjectInstance \"{name}\" AttributeEnd")
    return side * step
print('LookAt -50 -50 60  60 60 0  0 0 1\nCamera "perspective" "float fov" 50\nFilm "rgb" "integer xresolution" 320 '
      '"integer yresolution" 180\nWorldBegin\nLightSource "infinite" "rgb L" [ 1 1 1 ]')
print(f'ObjectBegin "one" {shape} ObjectEnd\nObjectBegin "row"')
side = grid(members, "one", 1)
print("ObjectEnd")
grid(places, "row", side)

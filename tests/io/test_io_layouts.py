"""Texts as other programs write them: separators, quotes, missing values, headers and the names in them."""

import numpy as np
import pytest

from edgel.io import FormatError, read

NAN = np.nan
ONE, TWO = (1.5, 2, 3), (4, 5, 6)


def read_text(tmp_path, text, **options):
    (tmp_path / "a.txt").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(tmp_path / "a.txt", **options)


LAYOUTS = {
    "tabs": ("x\ty\tz\ti\n1.5\t2\t3\t\n4\t5\t6\t7\n", {"i": [NAN, 7]}),
    "bars": ("x|y|z\n1.5|2|3\n4|5|6\n", {}),
    "pandas with an index": (",x,y,z\n0,1.5,2,3\n1,4,5,6\n", {"column_0": [0, 1]}),
    "pandas without names": ("0,1,2\n1.5,2.0,3.0\n4.0,5.0,6.0\n", {}),
    "pandas without names, with an index": (",0,1,2\n0,1.5,2.0,3.0\n1,4.0,5.0,6.0\n", {}),
    "R": ('"x" "y" "z"\n"1" 1.5 2 3\n"2" 4 5 6\n', {"column_0": [1, 2]}),
    "R, named rows": ('"x" "y" "z"\n"p" 1.5 2 3\n"q" 4 5 6\n', {"column_0": ["p", "q"]}),
    "a spreadsheet": ("sep=;\r\nx;y;z;\r\n1,5;2;3;\r\n4;5;6;\r\n;;;\r\n", {}),
    "quoted decimal commas": ('"x","y","z"\n"1,5","2,0","3"\n"4","5","6"\n', {}),
    "separators at the end": ("1.5, 2, 3, \n4, 5, 6, \n", {}),
    "Windows-1252": ("Rechtswert;Hochwert;Höhe;Größe\n1,5;2;3;7\n4;5;6;8\n".encode("cp1252"), {"Größe": [7, 8]}),
    "a mark of UTF-8, CRLF": (b"\xef\xbb\xbfX,Y,Z\r\n1.5,2,3\r\n4,5,6\r\n", {}),
    "UTF-16 without a mark": ("x,y,z\r\n1.5,2,3\r\n4,5,6\r\n".encode("utf-16-le"), {}),
    "lines that end in CR": ("x y z\r1.5 2 3\r4 5 6\r", {}),
    "Octave": ("% x y z\n1.5 2 3\n% half\n4 5 6\n", {}),
    "psql": (" x | y | z \n---+---+---\n 1.5 | 2 | 3\n 4 | 5 | 6\n", {}),
    "a preamble": ("Exported by a program 1.2\nof 2 points\n\nX,Y,Z,I\n1.5,2,3,8\n4,5,6,9\n", {"I": [8, 9]}),
    "units below the names": ("x;y;z;i\n[mm];[mm];[mm];[-]\n1,5;2;3;4\n4;5;6;7\n", {"i": [4, 7]}),
    "Fortran": ("1.5D+00 2.0D0 3.0d0\n4D0 5D0 6D0\n", {}),
    "C on Windows": ("1.5 2 3 -1.#IND\n4 5 6 -1.#INF\n", {"intensity": [NAN, -np.inf]}),
    "words for nothing": ("x,y,z,i,j\n1.5,2,3,NULL,N/A\n4,5,6,-nan(ind),<NA>\n", {"i": [NAN] * 2, "j": [NAN] * 2}),
    "flags": ("x,y,z,edge\n1.5,2,3,True\n4,5,6,False\n", {"edge": [1, 0]}),
    "a column of text": ('x,y,z,class\n1.5,2,3,"ground, wet"\n4,5,6,tree\n', {"class": ["ground, wet", "tree"]}),
    "names of points": ("P1,1.5,2,3,TREE\nP2,4,5,6,\n", {"text_0": ["P1", "P2"], "text_4": ["TREE", ""]}),
    "addresses": ("x,y,z,source\n1.5,2,3,http://a#b\n4,5,6,c\n", {"source": ["http://a#b", "c"]}),
    "short lines": ("x,y,z,i,j\n1.5,2,3,1,2\n4,5,6,7\n", {"i": [1, 7], "j": [2, NAN]}),
    "more than the header": ("x,y,z\n1.5,2,3\n4,5,6,7\n", {"column_3": [NAN, 7]}),
    "CloudCompare": (
        "//X Y Z R G B Scalar Nx Ny Nz\n2\n1.5 2 3 1 2 3 0.5 0 0 1\n4 5 6 4 5 6 0.6 0 0 1\n",
        {
            "red": [1, 4],
            "green": [2, 5],
            "blue": [3, 6],
            "Scalar": [0.5, 0.6],
            "nx": [0, 0],
            "ny": [0, 0],
            "nz": [1, 1],
        },
    ),
    "ParaView": (
        '"Points:0","Points:1","Points:2","Normals:0","Normals:1","Normals:2"\n1.5,2,3,0,0,1\n4,5,6,0,0,1\n',
        {"nx": [0, 0], "ny": [0, 0], "nz": [1, 1]},
    ),
    "ROS": ("%time,field.point.x,field.point.y,field.point.z\n1,1.5,2,3\n2,4,5,6\n", {"time": [1, 2]}),
    "a comment with a title": ("# Columns: id, x, y, z\n7, 1.5, 2, 3\n8, 4, 5, 6\n", {"id": [7, 8]}),
    "a comment after the names": ("# x y z class\n# metres\n1.5 2 3 9\n4 5 6 9\n", {"class": [9, 9]}),
    "normals before colors": (
        "1.5 2 3 0 0.6 0.8 10 20 30\n4 5 6 1 0 0 11 21 31\n",
        {"nx": [0, 1], "ny": [0.6, 0], "nz": [0.8, 0], "red": [10, 11], "green": [20, 21], "blue": [30, 31]},
    ),
    "colors before a label": (
        "1.5 2 3 10 20 30 900\n4 5 6 11 21 31 901\n",
        {"red": [10, 11], "green": [20, 21], "blue": [30, 31], "intensity": [900, 901]},
    ),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts(tmp_path, name):
    text, attributes = LAYOUTS[name]
    cloud = read_text(tmp_path, text)
    np.testing.assert_array_equal(cloud.xyz, [ONE, TWO])
    assert set(cloud.attributes) == set(attributes)
    for column, values in attributes.items():
        np.testing.assert_array_equal(cloud.attributes[column], values)


@pytest.mark.parametrize(
    "header",
    [
        "X,Y,Z",
        "Easting,Northing,Elevation",
        "EASTING (m),NORTHING (m),ORTHO HEIGHT (m)",
        "E,N,H",
        "East,North,Up",
        "X [mm],Y [mm],Z [mm]",
        "X(m),Y(m),Z(m)",
        "x_coord,y_coord,z_coord",
        "POINT_X,POINT_Y,POINT_Z",
        "Points:0,Points:1,Points:2",
        "Points_0,Points_1,Points_2",
        "coords:0,coords:1,coords:2",
        "pose.position.x,pose.position.y,pose.position.z",
        "X-Koordinate,Y-Koordinate,Z-Koordinate",
        "Ostwert,Nordwert,Höhe",
        "x,y,elevation",
    ],
)
@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("comment", ["", "# ", "//"])
def test_names_of_coordinates(tmp_path, header, separator, comment):
    names = header.split(",")
    if separator == " ":
        names = [name.replace("ORTHO HEIGHT", "HEIGHT") for name in names]
    order = [2, 0, 1]  # not the order of the columns but the names tell
    lines = [separator.join(["id", *(names[i] for i in order), "nx", "ny", "nz"])]
    lines += [separator.join(map(str, [7, *(point[i] for i in order), 0, 0, 1])) for point in (ONE, TWO)]
    cloud = read_text(tmp_path, comment + "\n".join(lines))
    np.testing.assert_array_equal(cloud.xyz, [ONE, TWO])
    assert list(cloud.attributes) == ["id", "nx", "ny", "nz"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z\n1,2,3\n4,5\n", "line 3: expected 3 numbers, found '4,5'"),
        ("x,y,z,i\n1,2,3,4\n5,6,7,eight\n9,9,9,9\n", "line 3: .*eight"),
        ("1 2 3 4\n4 5 6\n", "line 2: expected 4 numbers"),
        ("# id x y z\n7 1 2 3 8\n", "names 4 columns, the points have 5.*--columns"),
        ("lat,lon,alt\n52.1,13.2,40\n", "no lengths: project"),
        ("A,B,C\n1,2,3\n", "--columns"),
        ("vx,vy,vz\n1,2,3\n", "the columns are vx, vy, vz"),
        ("2\n1 2 3\n4 5 6\n2\n7 8 9\n", "declared 2 points in block 2, found 1"),
        ("a,b\nP,Q\n", "line 1"),
        ('{"x": [1, 2, 3], "y": [4, 5, 6], "z": [7, 8, 9]}\n', "line 1"),
        ("[[1.5 2. 3.]\n [4. 5. 6.]]\n", "line 1"),
    ],
)
def test_what_cannot_be_told_is_refused(tmp_path, text, message):
    with pytest.raises(FormatError, match=message):
        read_text(tmp_path, text)


def test_blocks_of_pts(tmp_path):
    rows = ["1 2 3 -5 1 2 3", "4 5 6 7 4 5 6", "7 8 9 8 7 8 9"]
    cloud = read_text(tmp_path, "\n".join(["2", *rows[:2], "", "1", rows[2], "0", ""]))
    assert cloud.xyz.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert cloud.attributes["intensity"].tolist() == [-5, 7, 8]
    assert cloud.attributes["blue"].tolist() == [3, 6, 9]
    assert cloud.attributes["scan_index"].tolist() == [0, 0, 1]


def test_columns_by_the_user(tmp_path):
    text = "time,a,b,c,d\n9,1.5,2,3,0.5\n9,4,5,6,0.25\n"
    cloud = read_text(tmp_path, text, columns="_,x,y,z,reflectance")
    np.testing.assert_array_equal(cloud.xyz, [ONE, TWO])
    assert {name: values.tolist() for name, values in cloud.attributes.items()} == {"reflectance": [0.5, 0.25]}
    assert list(read_text(tmp_path, text, columns=["t", "x", "y", "z"]).attributes) == ["t", "column_4"]
    assert read_text(tmp_path, "1 2 3\n", columns="z,y,x").xyz.tolist() == [[3, 2, 1]]
    with pytest.raises(FormatError, match=r"line 2 has 5 values, --columns .* names 6"):
        read_text(tmp_path, text, columns="x,y,z,a,b,c")
    for wrong in ("x,y", "x,y,z,z", ""):
        with pytest.raises(ValueError, match=r"columns: .* x, y and z have to be among the names"):
            read_text(tmp_path, text, columns=wrong)
    with pytest.raises(TypeError, match="columns: expected names"):
        read_text(tmp_path, text, columns=3)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("late", ["1.#QNAN 2 3 4", "nan nan nan nan", "1 2 3 4  # the last", "1,5 2 3 4"])
def test_what_comes_late_is_read_as_if_it_came_early(tmp_path, late):
    lines = ["1 2 3 4"] * 70_000
    cloud = read_text(tmp_path, "\n".join([*lines, late, late]))
    assert len(cloud) == 70_002
    np.testing.assert_array_equal(cloud.xyz[:70_000], np.tile([1.0, 2, 3], (70_000, 1)))
    np.testing.assert_array_equal(cloud.xyz[-1], read_text(tmp_path, f"{late}\n").xyz[0])
    np.testing.assert_array_equal(cloud.attributes["intensity"][:70_000], 4)

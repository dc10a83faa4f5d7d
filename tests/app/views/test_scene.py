"""Where things stand: a click on the plane finds the pixel it was meant for, and a preset shows all of the scene."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.views.scene import nodes
from app.views.scene.nodes import FIRST_STAYS, FramePlane, MapPlanes
from app.views.scene.space import DEPTH, Space, box_corners, camera_place
from etnet.events.events import Sensor

SENSORS = st.builds(Sensor, st.integers(1, 1280), st.integers(1, 720))


@settings(deadline=None)
@given(SENSORS, st.data(), st.floats(-3, 3), st.floats(-3, 3), st.floats(0.5, 50))
def test_a_ray_through_a_pixels_middle_hits_that_pixel(sensor, data, x, y, distance):
    space = Space(sensor)
    pixel = data.draw(st.tuples(st.integers(0, sensor.width - 1), st.integers(0, sensor.height - 1)))
    middle = space.place(np.array([[pixel[0] + 0.5, pixel[1] + 0.5, 0.0]], np.float32))[0].astype(float)
    eye = np.array([x, y, -distance])
    assert space.pixel_hit(eye, middle - eye) == pixel


def test_a_ray_that_misses_the_plane_hits_nothing():
    space = Space(Sensor(240, 180))
    ahead = np.array([0.0, 0.0, 1.0])
    assert space.pixel_hit(np.array([0.0, 0.0, 1.0]), ahead) is None
    assert space.pixel_hit(np.array([9.0, 0.0, -1.0]), ahead) is None
    assert space.pixel_hit(np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])) is None


@pytest.mark.parametrize("camera", ["orbit", "front", "side"])
@settings(deadline=None)
@given(sensor=SENSORS.filter(lambda s: 0.2 < s.width / s.height < 5), aspect=st.floats(0.3, 4))
def test_every_corner_lies_inside_the_picture_on_any_canvas(camera, sensor, aspect):
    space = Space(sensor)
    place = camera_place(space, camera, aspect)
    eye, at = np.array(place.position), np.array(place.look_at)
    forward = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(np.array([0.0, 1.0, 0.0]), forward)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    corners = box_corners(space)
    if camera == "front":
        corners = corners[corners[:, 2] == 0]  # the past lies behind the picture
    offsets = corners - eye
    depth = offsets @ forward
    half = np.tan(place.fov / 2)
    assert (depth > place.near).all()
    assert (depth < place.far).all()
    assert (np.abs(offsets @ down) / depth <= half).all()
    assert (np.abs(offsets @ right) / depth <= half * aspect).all()


@settings(deadline=None)
@given(sensor=SENSORS.filter(lambda s: 1 <= s.width / s.height < 2), aspect=st.floats(0.5, 3))
def test_the_booths_camera_comes_close_and_cuts_off_little(sensor, aspect):
    space = Space(sensor)
    place = camera_place(space, "booth", aspect)
    half = np.tan(place.fov / 2)
    across, down, depth = seen_from(place, box_corners(space))
    assert (depth > place.near).all()
    assert (depth < place.far).all()
    furthest = max((np.abs(across) / (half * aspect * depth)).max(), (np.abs(down) / (half * depth)).max())
    assert 0.9 < furthest < 1.2, "1 is the picture's edge"
    across, down, depth = seen_from(place, np.zeros((1, 3)))
    assert max(np.abs(across / aspect), np.abs(down)) < 0.7 * half * depth, "the middle of the image is seen"


def seen_from(place, points):
    """How far points lie to the right, down and ahead of a camera."""
    eye, at = np.array(place.position), np.array(place.look_at)
    forward = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(np.array([0.0, 1.0, 0.0]), forward)
    right /= np.linalg.norm(right)
    offsets = points - eye
    return offsets @ right, offsets @ np.cross(forward, right), offsets @ forward


class Images:
    """A scene that only holds images."""

    def __init__(self):
        self.held = {}

    def add_image(self, name, image, width, height, position, **more):
        handle = SimpleNamespace(image=image, position=position, visible=True, size=(width, height))
        handle.on_click = lambda heard: heard
        handle.remove = lambda: self.held.pop(name)
        self.held[name] = handle
        return handle

    def seen(self):
        return [handle for handle in self.held.values() if handle.visible]


def test_planes_stand_one_behind_the_other_and_go_when_they_are_not_wanted():
    images, space = Images(), Space(Sensor(40, 30))
    planes = MapPlanes(images)
    pictures = tuple(np.full((30, 40, 3), grey, np.uint8) for grey in (1, 2, 3))
    planes.show(space, "first", pictures)
    assert [handle.position[2] for handle in images.seen()] == pytest.approx([DEPTH / 3, 2 * DEPTH / 3, DEPTH])
    assert [handle.image[0, 0, 0] for handle in images.seen()] == [1, 2, 3]
    planes.show(space, "first", ())
    assert images.seen() == []
    planes.show(space, "second", pictures[:2])
    assert [handle.position[2] for handle in images.seen()] == pytest.approx([DEPTH / 2, DEPTH])
    wider = Space(Sensor(80, 30))
    planes.show(wider, "second", pictures[:1])
    assert [handle.size for handle in images.held.values()] == [(wider.width, wider.height)]


def test_a_new_planes_first_picture_is_not_replaced_before_a_slow_browser_has_drawn_it(monkeypatch):
    clock = [50.0]
    monkeypatch.setattr(nodes.time, "monotonic", lambda: clock[0])
    images, space = Images(), Space(Sensor(40, 30))
    plane = FramePlane(images, lambda intent: None)

    def shown(grey, is_moving):
        plane.show(space, grey, np.full((30, 40, 3), grey, np.uint8), is_moving)
        return int(images.held["/plane"].image[0, 0, 0])

    assert shown(1, is_moving=True) == 1
    assert shown(2, is_moving=True) == 1
    assert shown(3, is_moving=False) == 3
    clock[0] += FIRST_STAYS
    assert shown(4, is_moving=True) == 4

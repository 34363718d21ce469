// An orbit camera, {target, yaw, pitch, distance, fov, radius}, without three.js. Angles are in radians, except fov:
// the vertical field of view in degrees. `radius` is half the diagonal of the scene's box.

const LIMIT = (Math.PI / 2) * 0.999;

/** Returns the first camera of the scene file as an orbit camera; without one, a camera that shows the whole box. */
export function firstView(scene) {
  const low = scene.box.min;
  const high = scene.box.max;
  const middle = low.map((value, axis) => (value + high[axis]) / 2);
  const radius = Math.max(Math.hypot(...low.map((value, axis) => high[axis] - value)) / 2, 1e-6);
  const fov = scene.camera ? scene.camera.fov : 42;
  if (!scene.camera) {
    const camera = { target: middle, yaw: 0.55, pitch: 0.42, distance: 0, fov, radius };
    camera.distance = 1.06 * farEnough(camera, low, high);
    return camera;
  }
  // The target is the point on the axis of the file's camera that is nearest to the middle of the scene.
  const { position, forward } = scene.camera;
  const along = middle.reduce((sum, value, axis) => sum + (value - position[axis]) * forward[axis], 0);
  const distance = Math.max(along, radius * 0.1);
  return {
    target: position.map((value, axis) => value + forward[axis] * distance),
    yaw: Math.atan2(-forward[0], -forward[2]),
    pitch: Math.asin(Math.min(Math.max(-forward[1], -1), 1)),
    distance,
    fov,
    radius,
  };
}

// Returns the distance at which all corners of the box are visible, if the view is at least as wide as high.
function farEnough(camera, low, high) {
  const { right, up, forward } = frame(camera);
  const tall = Math.tan((camera.fov * Math.PI) / 360);
  const corners = Array.from({ length: 8 }, (_, k) => [0, 1, 2].map((axis) => ((k >> axis) & 1 ? high : low)[axis] - camera.target[axis]));
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  return Math.max(...corners.map((c) => Math.max(Math.abs(dot(c, right)), Math.abs(dot(c, up))) / tall - dot(c, forward)));
}

/** Returns {eye, right, up, forward} of a camera: its position, and unit vectors. */
export function frame(camera) {
  const [sy, cy, sp, cp] = [Math.sin(camera.yaw), Math.cos(camera.yaw), Math.sin(camera.pitch), Math.cos(camera.pitch)];
  const back = [sy * cp, sp, cy * cp];
  return {
    eye: camera.target.map((value, axis) => value + back[axis] * camera.distance),
    right: [cy, 0, -sy],
    up: [-sy * sp, cp, -cy * sp],
    forward: back.map((value) => -value),
  };
}

/** Rotates the camera about its target by angles in radians. */
export function turn(camera, yaw, pitch) {
  camera.yaw += yaw;
  camera.pitch = Math.min(Math.max(camera.pitch + pitch, -LIMIT), LIMIT);
}

/** Shifts the target parallel to the image plane; x and y are fractions of the view's height. */
export function shift(camera, x, y) {
  const { right, up } = frame(camera);
  const tall = 2 * camera.distance * Math.tan((camera.fov * Math.PI) / 360);
  camera.target = camera.target.map((value, axis) => value + (right[axis] * x + up[axis] * y) * tall);
}

/** Moves towards the target (steps > 0) or away; close to it, moves the target as well, so that users can enter rooms. */
export function zoom(camera, steps) {
  const wanted = camera.distance * 0.86 ** steps;
  const nearest = camera.radius * 0.04;
  if (wanted < nearest) fly(camera, 0, 0, nearest - wanted);
  camera.distance = Math.min(Math.max(wanted, nearest), camera.radius * 40);
}

/** Moves eye and target by x metres to the right, y metres up and z metres forward. */
export function fly(camera, x, y, z) {
  const { right, up, forward } = frame(camera);
  camera.target = camera.target.map((value, axis) => value + right[axis] * x + up[axis] * y + forward[axis] * z);
}

/** Returns the ray {origin, direction} through the image point (x, y); both are -1 to 1, y upwards. */
export function ray(camera, x, y, aspect) {
  const { eye, right, up, forward } = frame(camera);
  const tall = Math.tan((camera.fov * Math.PI) / 360);
  const direction = forward.map((value, axis) => value + right[axis] * x * tall * aspect + up[axis] * y * tall);
  const length = Math.hypot(...direction);
  return { origin: eye, direction: direction.map((value) => value / length) };
}

/** Returns the image point {x, y} of a point, in the coordinates of `ray`; null if it is behind the camera. */
export function project(camera, point, aspect) {
  const { eye, right, up, forward } = frame(camera);
  const away = point.map((value, axis) => value - eye[axis]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const depth = dot(away, forward);
  const tall = Math.tan((camera.fov * Math.PI) / 360);
  return depth <= 0 ? null : { x: dot(away, right) / (depth * tall * aspect), y: dot(away, up) / (depth * tall) };
}

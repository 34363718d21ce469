// Converts mouse, touch and wheel events of an element to drag, zoom, click and double-click calls.

const CLICK = 4; // largest movement during a click, pixels

/**
 * Adds listeners to the element `window_`, which call drag(x, y, shifting), wheel(steps, place), click(place) and
 * double(place) of `on`. x and y are fractions of the element's height; for `place` see the function of that name.
 */
export function listen(window_, on) {
  const down = new Map();
  let moved = 0;
  let pinch = 0;

  window_.addEventListener("contextmenu", (event) => event.preventDefault());
  window_.addEventListener("pointerdown", (event) => {
    window_.setPointerCapture(event.pointerId);
    down.set(event.pointerId, [event.clientX, event.clientY]);
    if (down.size === 1) moved = 0;
    pinch = spread(down);
  });
  window_.addEventListener("pointermove", (event) => {
    const last = down.get(event.pointerId);
    if (!last) return;
    const [x, y] = [event.clientX - last[0], event.clientY - last[1]];
    down.set(event.pointerId, [event.clientX, event.clientY]);
    moved += Math.abs(x) + Math.abs(y);
    if (moved <= CLICK) return;
    window_.classList.add("moving");
    const tall = window_.clientHeight;
    if (down.size > 1) {
      const now = spread(down);
      if (pinch > 0) on.wheel(Math.log(now / pinch) / -Math.log(0.86), place(window_, event));
      pinch = now;
      on.drag(x / tall / down.size, y / tall / down.size, true);
    } else {
      on.drag(x / tall, y / tall, event.shiftKey || (event.buttons & 6) !== 0);
    }
  });
  const up = (event) => {
    if (!down.delete(event.pointerId)) return;
    window_.classList.remove("moving");
    if (event.type === "pointerup" && moved <= CLICK && event.button === 0) on.click(place(window_, event));
  };
  window_.addEventListener("pointerup", up);
  window_.addEventListener("pointercancel", up);
  window_.addEventListener("dblclick", (event) => on.double(place(window_, event)));
  window_.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      // Convert lines (33) and pages (400) to pixels. A notch of most mice is 100 pixels.
      const pixels = event.deltaY * [1, 33, 400][event.deltaMode];
      on.wheel(Math.min(Math.max(-pixels / 60, -3), 3), place(window_, event));
    },
    { passive: false },
  );
}

/** Returns whether a key is not a shortcut: it goes to an input field, or has a modifier such as Ctrl. */
export function typing(event) {
  const target = event.target;
  if (event.ctrlKey || event.metaKey || event.altKey) return true;
  return target.tagName === "SELECT" || (target.tagName === "INPUT" && target.type === "number");
}

/** Returns whether the focused control uses the arrow keys itself: a slider or a radio button. */
export function ownsArrows(event) {
  return event.target.tagName === "INPUT" && (event.target.type === "range" || event.target.type === "radio");
}

// Returns the position of an event in the element: -1 to 1, x to the right, y upwards, 0 in the middle.
function place(window_, event) {
  const box = window_.getBoundingClientRect();
  return {
    x: ((event.clientX - box.left) / box.width) * 2 - 1,
    y: 1 - ((event.clientY - box.top) / box.height) * 2,
  };
}

function spread(down) {
  if (down.size < 2) return 0;
  const [a, b] = [...down.values()];
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

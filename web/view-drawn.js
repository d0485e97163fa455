// Runs in the frame of the 3-D view: tells the page around it when there is something to see.

/** The robot alone has some twenty thousand; the axes and the ground, which come first, a thousand. */
const FEWEST_TRIANGLES = 4000;

/**
 * Marks the document `data-view="loading"`, and `data-view="drawn"` once the robot is on the screen.
 *
 * @param {(callback: () => void) => void} nextFrame Calls at the browser's next frame.
 * @param {() => boolean} shown Has all that was drawn come to the screen?
 */
export const tellWhenDrawn = (nextFrame, shown) => {
  document.documentElement.dataset.view ??= "loading";
  const { prototype } = WebGL2RenderingContext;
  const { drawElements } = prototype;
  let triangles = 0;
  prototype.drawElements = function (mode, count, type, offset) {
    triangles += count / 3;
    drawElements.call(this, mode, count, type, offset);
  };
  const tell = () => {
    if (shown()) document.documentElement.dataset.view = "drawn";
    else nextFrame(tell);
  };
  const look = () => {
    if (triangles < FEWEST_TRIANGLES) {
      triangles = 0;
      nextFrame(look);
      return;
    }
    prototype.drawElements = drawElements;
    tell();
  };
  nextFrame(look);
};

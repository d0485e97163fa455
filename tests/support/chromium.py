"""Command-line options of a headless Chromium that shows the page."""

#: A page without the 3-D view.
FLAT_FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
#: The 3-D view needs WebGL, and a machine without a GPU draws it in software.
FLAGS = (
    *(flag for flag in FLAT_FLAGS if flag != "--disable-gpu"),
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    # As a browser without a graphics card does: only the 3-D view is drawn by way of OpenGL, not the whole page.
    "--disable-gpu-compositing",
)

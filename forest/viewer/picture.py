"""The one picture that all pages show: how large it is, where it lies in a page, how smooth."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from forest.viewer.app import App

#: Samples of a pixel of a picture at rest (MSAA); one while the view turns or a tool drags.
SAMPLES = 4


def place_in(
    across: float, down: float, page: tuple[float, float], picture: tuple[int, int]
) -> tuple[float, float]:
    """Give where a point of a page lies in a picture that is fitted into it, whole and undistorted.

    Parameters
    ----------
    across, down : float
        The point, pixels of the page's view from its upper left corner.
    page, picture : (float, float)
        Width and height of the page's view and of the picture, pixels.

    Returns
    -------
    (float, float)
        Shares of the picture's width and height; outside 0 to 1 beside the picture.
    """
    width, height = page
    scale = min(width / picture[0], height / picture[1])
    shown = picture[0] * scale, picture[1] * scale
    return (
        (across - 0.5 * (width - shown[0])) / shown[0],
        (down - 0.5 * (height - shown[1])) / shown[1],
    )


class Picture:
    """The picture of an app's stage.

    It has the size of the page that was entered by the pointer or resized last; other pages show
    it whole, with margins.

    Parameters
    ----------
    app : App
    """

    def __init__(self, app: App) -> None:
        self._app, self._window = app, app.stage.window
        self._window.AddObserver("StartEvent", lambda *_: self._choose_samples())
        app.server.controller.trigger("entered")(self.fit)

    def place(self, across: float, down: float, width: float, height: float) -> tuple[float, float]:
        """Give where a point of a page of this size lies in the picture; see `place_in`."""
        return place_in(across, down, (width, height), self._window.GetSize())

    def fit(self, width: float, height: float) -> None:
        """Give the picture the size (pixels) of a page that the pointer has come to."""
        app = self._app
        size = [round(width), round(height)]
        if self._turning or min(size) < 1 or list(self._window.GetSize()) == size:
            return
        app.server.protocol_call("viewport.image.push.original.size", app.state.pictureId, *size)
        app.push()

    @property
    def _turning(self) -> bool:
        """Whether a page turns the view, so that pictures are small."""
        asked = self._app.server.protocol_call(
            "viewport.image.push.quality.get", self._app.state.pictureId
        )
        return bool(asked["ratio"] < 1.0)

    def _choose_samples(self) -> None:
        if self._app.server.protocol:
            moves = self._turning or self._app.dragging
            self._window.SetMultiSamples(0 if moves else SAMPLES)

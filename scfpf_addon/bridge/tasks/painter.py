# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a viewport, made by a background task: the latest request cancels those before it."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

from ...casting.common.cancellation import Cancelled
from ...projection.user_error import UserError
from ..blender.user_errors import failure_message
from .task import Task

Request = TypeVar("Request")
Image = TypeVar("Image")


class Painter(Generic[Request, Image]):
    """Paints the latest request. A subclass defines ``_paint``; only Blender's main thread calls the rest.

    A task serves requests as long as there are any: a drag would otherwise start a thread a move. A timer
    redraws the viewport, and ends when the painter is not ``busy``.

    image, message: the newest image, or the message of an error instead. number: differs with each of them.
    asked: the number of requests. answered: that of the last request that has an image or a message.
    """

    def __init__(self, name: str) -> None:
        """name: of the thread."""
        self._name = name
        self._wake = threading.Condition()
        self._wanted: Request | None = None
        self._task: Task[None] | None = None
        self._stopped = False
        self.image: Image | None = None
        self.message = ""
        self.number = self.asked = self.answered = 0
        # ``asked`` as the request at hand was taken.
        self._at_hand = 0

    def _paint(self, request: Request) -> None:
        """Make the images of a request, in the thread, and ``_show`` each. End early if ``is_set``."""
        raise NotImplementedError

    @property
    def busy(self) -> bool:
        """Return whether the thread is at work."""
        with self._wake:
            return self._task is not None

    def ask(self, request: Request) -> None:
        """Paint this, and drop earlier requests; return at once."""
        with self._wake:
            self._wanted = request
            self.asked += 1
            self._wake.notify_all()
            if self._task is not None or self._stopped:
                return
            task = Task(self._serve, self._name)
            try:
                task.start()
            except UserError as error:
                self._wanted, self._at_hand = None, self.asked
                self._show(None, failure_message(error))
            else:
                self._task = task

    def wait(self, seconds: float) -> bool:
        """Wait at most so long for the first image of the last request; return whether it is there."""
        with self._wake:
            return self._wake.wait_for(lambda: self.answered == self.asked or self._stopped, seconds)

    def retire(self) -> None:
        """Cancel for ever; return at once."""
        with self._wake:
            self._stopped, self._wanted = True, None
            self._wake.notify_all()

    def stop(self) -> None:
        """Cancel for ever and wait for the thread."""
        self.retire()
        task = self._task
        if task is not None:
            task.wait()
        self.image = None

    def is_set(self) -> bool:
        """Return whether the request at hand is cancelled: the painter is the signal of its own casting."""
        return self._stopped or self._wanted is not None

    def _serve(self, _task: Task[None]) -> None:
        while True:
            with self._wake:
                request, self._wanted = self._wanted, None
                if request is None or self._stopped:
                    self._task = None
                    return
                self._at_hand = self.asked
            try:
                self._paint(request)
            except Cancelled:
                # A newer request waits, or the view has ended.
                pass
            except Exception as error:  # A thread has nowhere to raise.
                self._show(None, failure_message(error))

    def _show(self, image: Image | None, message: str = "") -> None:
        """Publish an image of the request at hand, or a message instead."""
        with self._wake:
            self.image, self.message = image, message
            self.number += 1
            self.answered = self._at_hand
            self._wake.notify_all()

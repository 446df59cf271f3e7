# SPDX-License-Identifier: GPL-3.0-or-later
"""New objects are seen in the local view in which they are made, as those that Blender adds."""


def show_in_local_view(context, objects) -> None:
    """Take objects into the local view of the 3D viewport at hand, if it is in one."""
    space = context.space_data
    if space is None or space.type != "VIEW_3D" or space.local_view is None:
        return
    context.view_layer.update()
    for obj in objects:
        if obj is not None and obj.name in context.view_layer.objects:
            obj.local_view_set(space, True)

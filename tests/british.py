# SPDX-License-Identifier: GPL-3.0-or-later
"""British spellings, for tests of the interface: Blender's texts are in American English."""

import re

WORDS = (
    r"\w*(?:colour|neighbour|behaviour|favour|honour|labour|vapour|harbour|flavour|rumour|odour|armour)\w*|"
    r"\w*centr(?:e|ed|es|ing)\b|(?:kilo|centi|milli|dia|para)?metre\w*|fibre\w*|litre\w*|calibre\w*|theatre\w*|"
    r"grey\w*|catalogue\w*|analogue\w*|dialogue\w*|artefact\w*|aluminium|anticlockwise|discs?|half-way|"
    r"\w*(?:cancell|modell|labell|travell|levell|signall|channell|tunnell|fuell|pencill)(?:ed|ing|er)\w*|"
    r"licences?|licenced|defence|offence|practis\w+|programmes?|judgement|mould\w*|plough\w*|storey\w*|"
    r"draught\w*|whilst|amongst|focuss\w+|sceptic\w*|(?:ana|para|cata)lys(?:e|ed|es|ing)|"
    r"\w+is(?:e|es|ed|er|ers|ing|ation|ations)|\w{3,}isable"
)
# Words in -ise everywhere, without their endings.
ISE = (
    r"(?:de)?nois|p?rais|a?ris|sunris|surpris|compris|enterpris|\w*wis|precis|concis|promis|compromis|premis|"
    r"exercis|revis|advis|devis|supervis|improvis|disguis|advertis|expertis|franchis|vis|mis"
)
BRITISH = re.compile(rf"\b(?!(?:{ISE})(?:e|es|ed|er|ers|ing|able)\b)(?:{WORDS})\b", re.IGNORECASE)


def british(text: str) -> list[str]:
    """The words of a text that are spelled as in Britain."""
    return BRITISH.findall(text)

"""stub until the reader lands"""
from dataclasses import dataclass, field
import numpy as np
@dataclass(frozen=True)
class Trial:
    name: str
    kind: str
    columns: dict
    time: np.ndarray
    conditions: dict = field(default_factory=dict)
    role: str | None = None
    @property
    def dt(self): return float(np.median(np.diff(self.time)))
    def __len__(self): return len(self.time)
    def __getitem__(self, k): return self.columns[k]

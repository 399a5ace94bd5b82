import { opener } from "./rapier.mjs";

export const open = opener("@dimforge/rapier3d-compat", true);

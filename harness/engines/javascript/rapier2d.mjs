import { opener } from "./rapier.mjs";

export const open = opener("@dimforge/rapier2d-compat", false);

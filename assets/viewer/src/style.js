// Everything is under .pv, so that the viewer neither takes from nor gives to the page's own style.
export const STYLE = `
.pv { container-type: inline-size; position: relative; display: flex; background: #f3f4f6; color: #1f2937;
  font: 14px/1.4 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
  border: 1px solid #e5e7eb; border-radius: 14px; overflow: hidden; }
.pv *, .pv *::before { box-sizing: border-box; }
.pv-stage { position: relative; flex: 1 1 auto; min-width: 0; height: clamp(360px, 64vh, 660px); }
.pv-stage canvas { display: block; width: 100%; height: 100%; object-fit: contain; cursor: grab; outline: none; }
.pv-stage canvas:active { cursor: grabbing; }
.pv-hint { position: absolute; left: 14px; bottom: 11px; right: 14px; font-size: 12px; color: #6b7280; pointer-events: none; }
.pv-shot { display: none; position: absolute; inset: 0; pointer-events: none; }
.pv-in-shot .pv-shot { display: block; }
.pv-in-shot .pv-hint { display: none; }
.pv-picture { position: absolute; display: block; }
.pv .pv-wipe { position: absolute; left: 12%; width: 76%; bottom: 10px; pointer-events: auto; }
.pv-home { position: absolute; left: 12px; top: 12px; }
.pv-switches { position: absolute; right: 12px; top: 12px; display: flex; flex-wrap: wrap; justify-content: flex-end; gap: 6px; max-width: 70%; }
.pv-switch[aria-pressed="true"] { background: #1d4ed8; border-color: #1d4ed8; color: #fff; }
.pv-switch[aria-pressed="true"]:hover { background: #1e40af; color: #fff; }
.pv-button { font: inherit; font-size: 12.5px; line-height: 1; padding: 7px 10px; border: 1px solid #d1d5db; border-radius: 8px;
  background: #fff; color: #1f2937; cursor: pointer; white-space: nowrap; }
.pv-button:hover:not(:disabled) { border-color: #2563eb; color: #1d4ed8; }
.pv-button:disabled { color: #9ca3af; background: #f9fafb; cursor: default; }
.pv :focus-visible { outline: 2px solid #2563eb; outline-offset: 2px; }
.pv-panel { flex: 0 0 300px; width: 300px; display: flex; flex-direction: column; background: #fff; border-left: 1px solid #e5e7eb;
  max-height: clamp(360px, 64vh, 660px); }
.pv-head { display: flex; align-items: center; justify-content: space-between; gap: 8px; padding: 12px 14px; border-bottom: 1px solid #eef0f3; }
.pv-title { font-weight: 650; }
.pv-both { display: flex; gap: 6px; }
.pv-both[hidden] { display: none; }
.pv-list { position: relative; list-style: none; margin: 0; padding: 6px; overflow-y: auto; flex: 1 1 auto; }
.pv-none { margin: 14px; color: #6b7280; }
.pv-row { padding: 8px 10px 9px; border-radius: 10px; }
.pv-row + .pv-row { margin-top: 2px; }
.pv-row.pv-hot { background: #eff4ff; }
.pv-row-top { display: flex; align-items: baseline; justify-content: space-between; gap: 10px; }
.pv-name { font: inherit; font-weight: 550; text-align: left; padding: 0; border: 0; background: none; color: inherit; cursor: pointer;
  overflow-wrap: anywhere; }
.pv-name:hover { color: #1d4ed8; }
.pv-value { font-variant-numeric: tabular-nums; color: #374151; white-space: nowrap; }
.pv-row-foot { display: flex; align-items: center; justify-content: space-between; font-size: 11.5px; color: #6b7280;
  font-variant-numeric: tabular-nums; }
.pv-badge { font-size: 11px; line-height: 1; padding: 3px 8px; border-radius: 99px; font-weight: 600; }
.pv-pass { background: #dcfce7; color: #166534; }
.pv-fail { background: #fee2e2; color: #991b1b; }
.pv-undetermined { background: #fef3c7; color: #92400e; }
.pv-slider { -webkit-appearance: none; appearance: none; display: block; width: 100%; height: 22px; margin: 2px 0 0; background: none; cursor: pointer; }
.pv-slider::-webkit-slider-runnable-track { height: 4px; border-radius: 4px;
  background: linear-gradient(to right, #2563eb var(--pv-filled, 0%), #dfe3e8 var(--pv-filled, 0%)); }
.pv-slider::-moz-range-track { height: 4px; border-radius: 4px; background: #dfe3e8; }
.pv-slider::-moz-range-progress { height: 4px; border-radius: 4px; background: #2563eb; }
.pv-slider::-webkit-slider-thumb { -webkit-appearance: none; appearance: none; width: 16px; height: 16px; margin-top: -6px; border-radius: 50%;
  background: #fff; border: 2px solid #2563eb; }
.pv-slider::-moz-range-thumb { width: 12px; height: 12px; border-radius: 50%; background: #fff; border: 2px solid #2563eb; }
.pv-slider:disabled { opacity: .45; cursor: default; }
.pv-message { margin: auto; padding: 56px 28px; max-width: 34em; text-align: center; color: #4b5563; }
.pv-lost { display: none; position: absolute; inset: 0; max-width: none; background: #f3f4f6; }
.pv-is-lost .pv-lost { display: block; }
@media screen and (max-width: 760px) {
  .pv { flex-direction: column; }
  .pv-stage { flex: none; height: min(96vw, 58vh); min-height: 300px; }
  .pv-panel { flex: none; width: auto; max-height: none; border-left: 0; border-top: 1px solid #e5e7eb; }
  .pv-hint { font-size: 11.5px; }
}
@media print {
  .pv-panel, .pv-hint, .pv-home, .pv-switches, .pv .pv-wipe { display: none; }
  .pv { break-inside: avoid; background: none; border: 0; }
  .pv-stage { height: auto; }
  .pv-stage canvas { height: auto; max-height: 125mm; }
}
`;

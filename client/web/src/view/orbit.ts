/** A turntable camera as a value: several views may share one, which is what links them. */
import { PerspectiveCamera, Vector3 } from 'three';

const HOME = { yaw: 0.55, pitch: 0.22, distance: 3.15, panX: 0, panY: 0 };

export class Orbit {
  yaw = HOME.yaw;
  pitch = HOME.pitch;
  distance = HOME.distance;
  panX = HOME.panX;
  panY = HOME.panY;

  rotate(dx: number, dy: number) {
    this.yaw -= dx;
    this.pitch = Math.max(-1.55, Math.min(1.55, this.pitch + dy));
  }
  zoom(factor: number) {
    this.distance = Math.max(0.25, Math.min(20, this.distance * factor));
  }
  pan(dx: number, dy: number) {
    this.panX -= dx * this.distance;
    this.panY += dy * this.distance;
  }
  reset() {
    Object.assign(this, HOME);
  }

  apply(camera: PerspectiveCamera, aspect: number) {
    // a narrow view backs off so that the shape still fits across
    const distance = this.distance / Math.min(1, aspect);
    const c = Math.cos(this.pitch);
    const back = new Vector3(Math.sin(this.yaw) * c, Math.sin(this.pitch), Math.cos(this.yaw) * c);
    const right = new Vector3(Math.cos(this.yaw), 0, -Math.sin(this.yaw));
    const up = new Vector3().crossVectors(back, right);
    const target = right.multiplyScalar(this.panX).addScaledVector(up, this.panY);
    camera.position.copy(target).addScaledVector(back, distance);
    camera.up.set(0, 1, 0);
    camera.lookAt(target);
    camera.aspect = aspect;
    camera.near = Math.max(0.01, distance - 3);
    camera.far = distance + 6;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  toString(): string {
    return [this.yaw, this.pitch, this.distance, this.panX, this.panY].map((x) => +x.toFixed(3)).join(',');
  }
  restore(text: string) {
    const values = text.split(',').map(Number);
    if (values.length !== 5 || !values.every(Number.isFinite)) return;
    [this.yaw, this.pitch, this.distance, this.panX, this.panY] = values;
  }
}
